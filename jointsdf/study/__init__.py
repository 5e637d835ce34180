"""Result rows -> tables. Imports no torch: the tables are made on any machine that has the rows."""
