"""Mission files and scripts: documents with places, scripts, typed values and the entries that hold them."""
