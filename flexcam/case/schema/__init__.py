"""Records of the case format, one module per group of tables."""
