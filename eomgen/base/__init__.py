"""Text made safe to print, errors, files written whole, streams, kept results, plugins, version."""
