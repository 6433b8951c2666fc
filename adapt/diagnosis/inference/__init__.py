"""From fitted hypotheses to an answer: evidence over priors, discrepancy, ranking, verdict, held-out gaps."""
