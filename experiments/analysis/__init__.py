"""What a record says: errors, links, frames, and whether chance explains them; tables, traces and exports of it."""
