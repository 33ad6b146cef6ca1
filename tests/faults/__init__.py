"""What happens when processes, disks and links fail."""
