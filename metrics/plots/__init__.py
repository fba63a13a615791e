"""Charts and tables of measured quality; no measure is computed here."""
