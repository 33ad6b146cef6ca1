"""Trial runs of a study on a virtual clock, without robot and journal; nothing is saved."""
