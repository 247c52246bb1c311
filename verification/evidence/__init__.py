"""The evidence that cases record: checks and studies, the plugin of pytest that collects them, and the pages."""
