"""The commands: what each is stands in `table`; its module is imported when it is called."""
