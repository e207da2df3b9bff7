"""What mission files and scripts say: documents with places, scripts, typed values and the entries that hold them."""
