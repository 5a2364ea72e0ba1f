"""What an arm reaches, carries and yields over its reach."""
