"""An independent simulator of planar pushing: a slider on discrete support points with Coulomb friction."""
