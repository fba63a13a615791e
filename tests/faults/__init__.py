"""Bad input, full disks, killed processes and wrong arguments, across packages."""
