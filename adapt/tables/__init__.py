"""Results as pandas tables: the columns of every CSV file."""
