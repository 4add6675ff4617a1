-- Every simulated hypothesis without its steps.
SELECT key, unnest(run)
FROM (
    SELECT
        key,
        unnest(from_json(content, '[{
            "hypothesis": "INTEGER", "backend": "VARCHAR", "backend_version": "VARCHAR", "step_s": "DOUBLE",
            "duration_s": "DOUBLE", "termination": "VARCHAR", "reason": "VARCHAR",
            "contacts": [{
                "time_s": "DOUBLE", "duration_s": "DOUBLE", "x_m": "DOUBLE", "y_m": "DOUBLE", "number_1": "INTEGER",
                "number_2": "INTEGER", "closing_speed_mps": "DOUBLE", "impulse_ns": "DOUBLE",
                "delta_v_1_mps": ["DOUBLE"], "delta_v_2_mps": ["DOUBLE"],
                "crush_1_m": "DOUBLE", "crush_2_m": "DOUBLE"
            }]
        }]')) AS run
    FROM document
)
