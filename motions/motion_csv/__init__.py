"""Reading, checking and writing of motion files (CSV): columns, cells, rows and postures."""
