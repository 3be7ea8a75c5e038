"""Reports as HTML files, and the folders that hold them."""
