-- What the draws of every estimate came to.
SELECT
    key,
    unnest(from_json(content, '{
        "drawn": "INTEGER", "effective": "DOUBLE", "contacts": [{"weight": "DOUBLE"}],
        "intervals": [{
            "quantity": "VARCHAR", "unit": "VARCHAR", "party": "INTEGER", "best": "DOUBLE", "low": "DOUBLE",
            "middle": "DOUBLE", "high": "DOUBLE"
        }]
    }'))
FROM document
