"""What every room shares: progress, threads of the linear algebra, files that are written whole."""
