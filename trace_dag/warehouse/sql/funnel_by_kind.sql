-- The funnel of each kind of crash by itself; a kind that is not known yet is a row of its own, so that all add up.
CREATE VIEW funnel_by_kind AS
WITH passed AS (
    SELECT
        crashes.key,
        coalesce(crashes.kind, 'not_known') AS kind,
        coalesce(max(stage_number) FILTER (outcome = 'accepted'), 0)
            + bool_or(final_state = 'verified')::INTEGER AS stages
    FROM crashes
    LEFT JOIN stage_outcomes USING (key)
    GROUP BY crashes.key, crashes.kind
)
SELECT
    kind,
    count(*) AS registered,
    round(100 * count(*) / sum(count(*)) OVER (), 2) AS share_pct,
    count(*) FILTER (stages >= 2) AS complete,
    count(*) FILTER (stages >= 4) AS mapped,
    count(*) FILTER (stages >= 5) AS estimated,
    count(*) FILTER (stages >= 6) AS collided,
    count(*) FILTER (stages >= 7) AS accepted,
    count(*) FILTER (stages >= 8) AS verified
FROM passed
GROUP BY kind
ORDER BY registered DESC, kind;

COMMENT ON VIEW funnel_by_kind IS 'Numbers of crashes of each kind that passed each step';
COMMENT ON COLUMN funnel_by_kind.kind IS 'Kind of crash; not_known where neither report nor source say it yet';
COMMENT ON COLUMN funnel_by_kind.registered IS 'Crashes of that kind';
COMMENT ON COLUMN funnel_by_kind.share_pct IS 'Their share of all registered crashes, per cent';
COMMENT ON COLUMN funnel_by_kind.complete IS 'Of those, with enough facts in the report';
COMMENT ON COLUMN funnel_by_kind.mapped IS 'Of those, with a road map';
COMMENT ON COLUMN funnel_by_kind.estimated IS 'Of those, with an estimate of the states';
COMMENT ON COLUMN funnel_by_kind.collided IS 'Of those, that collide in simulation';
COMMENT ON COLUMN funnel_by_kind.accepted IS 'Of those, accepted: by their first event at least';
COMMENT ON COLUMN funnel_by_kind.verified IS 'Of those, verified: everything reported that can be modelled happens';
