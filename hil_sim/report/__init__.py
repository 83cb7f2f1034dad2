"""What experiments say: tables, figures, and the report that holds them."""
