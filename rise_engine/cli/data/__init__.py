"""Commands that use and publish results."""
