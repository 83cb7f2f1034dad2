"""The messages that travel, their CDR form and the table of topics."""
