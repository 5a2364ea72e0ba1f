"""Communication with a language model: prompts, answers, transcripts, budgets and drafts."""
