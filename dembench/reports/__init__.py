"""Figures, tables and one page that opens offline."""
