"""The modular altitude filter of Bavle 2017: components put together, and measurements in any order."""
