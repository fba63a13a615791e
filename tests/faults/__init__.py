"""Bad input, full disks, kills and wrong arguments, across packages."""
