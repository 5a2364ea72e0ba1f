"""Sources of design proposals: rules, language models, recordings and people."""
