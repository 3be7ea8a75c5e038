"""One estimation problem, written for each of the tools that `benchmarks/peers.py` compares."""
