CREATE TABLE run (
    id VARCHAR(64) NOT NULL PRIMARY KEY,
    cell VARCHAR(64) NOT NULL,
    product VARCHAR(64) NOT NULL,
    config_hash VARCHAR(16) NOT NULL,
    seed BIGINT NOT NULL,
    boxes BIGINT NOT NULL,
    started_ns BIGINT NOT NULL,
    outcome VARCHAR(64) NOT NULL
)
