"""Files that try to execute, to escape a folder, to exhaust a machine, or to inject markup."""
