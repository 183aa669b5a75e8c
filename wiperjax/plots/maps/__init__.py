"""Pictures of maps. Read `planes`, `categories`, `classes`, `line`, `overview`."""
