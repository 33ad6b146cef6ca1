"""Acts as BML 1.0, and BML as acts."""
