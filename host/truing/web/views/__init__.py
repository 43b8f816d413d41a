"""Content of figures and tables as plain data, independent of the pages."""
