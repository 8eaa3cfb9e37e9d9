"""What the program asks of the machine it runs on: files, signals, streams, worker processes."""
