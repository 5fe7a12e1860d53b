"""What `doctor` checks of the installation, and its findings."""
