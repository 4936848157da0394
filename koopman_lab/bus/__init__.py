"""The bus between processes: channels, nodes, and the runners in real time and in lockstep."""
