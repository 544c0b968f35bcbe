"""The court of policies: suites of exercises with seeds and difficulties, verdicts, and their comparison."""
