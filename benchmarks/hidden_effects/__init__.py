"""Benches with hidden effects: a truth simulator of its own, its cases, and the judge of what was said of them."""
