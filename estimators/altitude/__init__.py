"""The modular altitude filter of Bavle 2017: a filter of components, and measurements that arrive out of order."""
