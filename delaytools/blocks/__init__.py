"""The physics, one piece per file: blocks with values, and formulas stated once."""
