"""Monitoring of a running mission: Groot2, the page in the browser, the record."""
