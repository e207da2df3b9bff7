"""Who looks on while a mission runs: Groot2, the page in the browser, the record."""
