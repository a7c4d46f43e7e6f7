"""Comparisons with other libraries, each in one interleaved run: `python -m bench.compare NAME`."""
