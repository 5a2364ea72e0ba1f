"""Many runs, methods and existing arms, executed and compared."""
