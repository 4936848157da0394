"""What `klab doctor` looks at: the installation, the bus, the machine."""
