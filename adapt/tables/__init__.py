"""Results as tables: the columns of every CSV file. Pandas lives here."""
