"""What can happen in a study, found before anybody comes: all situations of a scenario."""
