"""The language model: what it is told, how it is asked, and what was said."""
