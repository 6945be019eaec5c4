CREATE SCHEMA inverse_service;
CREATE TABLE inverse_service.batches (
    id text NOT NULL,
    kind text NOT NULL,
    client text NOT NULL,
    created double precision NOT NULL,
    total integer NOT NULL,
    answers integer DEFAULT 0 NOT NULL
);
CREATE TABLE inverse_service.bodies (
    id text NOT NULL,
    status text NOT NULL,
    body bytea NOT NULL
);
CREATE TABLE inverse_service.events (
    id text NOT NULL,
    number bigint NOT NULL,
    kind text NOT NULL,
    data text NOT NULL
);
CREATE TABLE inverse_service.jobs (
    sequence bigint NOT NULL,
    id text NOT NULL,
    kind text NOT NULL,
    document text NOT NULL,
    options text NOT NULL,
    status text NOT NULL,
    client text NOT NULL,
    priority integer NOT NULL,
    created double precision NOT NULL,
    started double precision,
    finished double precision,
    attempt integer DEFAULT 0 NOT NULL,
    crashes integer DEFAULT 0 NOT NULL,
    restarts integer DEFAULT 0 NOT NULL,
    revision integer DEFAULT 0 NOT NULL,
    owner text,
    heartbeat double precision,
    wall double precision DEFAULT 0 NOT NULL,
    cpu double precision DEFAULT 0 NOT NULL,
    memory double precision DEFAULT 0 NOT NULL
);
ALTER TABLE inverse_service.jobs ALTER COLUMN sequence ADD GENERATED ALWAYS AS IDENTITY (
    SEQUENCE NAME inverse_service.jobs_sequence_seq
    START WITH 1
    INCREMENT BY 1
    NO MINVALUE
    NO MAXVALUE
    CACHE 1
);
CREATE TABLE inverse_service.lines (
    batch text NOT NULL,
    number integer NOT NULL,
    identifier text NOT NULL,
    job text,
    problem bytea,
    order_number integer
);
CREATE TABLE inverse_service.versions (
    version integer NOT NULL
);
INSERT INTO inverse_service.batches VALUES ('batch', 'solve', 'alice', 1795205277.789814, 4, 3);
INSERT INTO inverse_service.bodies VALUES ('answered', 'successful', '\x7b2276657264696374223a2022766172696174696f6e616c227d');
INSERT INTO inverse_service.bodies VALUES ('failed', 'failed', '\x7b22737461747573223a203432322c202264657461696c223a20226e6f227d');
INSERT INTO inverse_service.events VALUES ('answered', 1, 'status', '{"status": "running"}');
INSERT INTO inverse_service.jobs OVERRIDING SYSTEM VALUE VALUES (1, 'answered', 'solve', '{"name": "answered"}', '{"memory_limit":4096,"seed":1,"time_limit":60.0}', 'successful', 'alice', 0, 1795205277.74279, 1795205277.744559, 1795205277.751612, 1, 0, 0, 1, NULL, 1795205277.744562, 1, 0.5, 64);
INSERT INTO inverse_service.jobs OVERRIDING SYSTEM VALUE VALUES (2, 'failed', 'solve', '{"name": "failed"}', '{"memory_limit":4096,"seed":1,"time_limit":60.0}', 'failed', 'bob', 0, 1795205277.753416, 1795205277.760758, 1795205277.765287, 1, 0, 0, 1, NULL, 1795205277.76077, 0, 0, 0);
INSERT INTO inverse_service.jobs OVERRIDING SYSTEM VALUE VALUES (3, 'cancelled', 'solve', '{"name": "cancelled"}', '{"memory_limit":4096,"seed":1,"time_limit":60.0}', 'dismissed', 'bob', 0, 1795205277.775456, NULL, 1795205277.776389, 0, 0, 0, 0, NULL, NULL, 0, 0, 0);
INSERT INTO inverse_service.jobs OVERRIDING SYSTEM VALUE VALUES (4, 'running', 'solve', '{"name": "running"}', '{"memory_limit":4096,"seed":1,"time_limit":60.0}', 'running', 'alice', 0, 1795205277.783875, 1795205277.78482, NULL, 1, 0, 0, 0, 'o', 1795205277.784823, 0, 0, 0);
INSERT INTO inverse_service.jobs OVERRIDING SYSTEM VALUE VALUES (5, 'waiting', 'solve', '{"name": "waiting"}', '{"memory_limit":4096,"seed":1,"time_limit":60.0}', 'accepted', 'bob', 0, 1795205277.785834, NULL, NULL, 0, 0, 0, 0, NULL, NULL, 0, 0, 0);
INSERT INTO inverse_service.jobs OVERRIDING SYSTEM VALUE VALUES (6, 'line', 'solve', '{"name": "line"}', '{"memory_limit":4096,"seed":1,"time_limit":60.0}', 'accepted', 'alice', 10, 1795205277.787325, NULL, NULL, 0, 0, 0, 0, NULL, NULL, 0, 0, 0);
INSERT INTO inverse_service.jobs OVERRIDING SYSTEM VALUE VALUES (7, 'gone', 'solve', '{"name": "gone"}', '{"memory_limit":4096,"seed":1,"time_limit":60.0}', 'dismissed', 'alice', 10, 1795205277.787366, NULL, 1795205277.80011, 0, 0, 0, 0, NULL, NULL, 0, 0, 0);
INSERT INTO inverse_service.lines VALUES ('batch', 1, '"a"', 'answered', NULL, 1);
INSERT INTO inverse_service.lines VALUES ('batch', 2, '"b"', 'line', NULL, NULL);
INSERT INTO inverse_service.lines VALUES ('batch', 4, '4', NULL, '\x7b22737461747573223a203432322c202264657461696c223a2022626164227d', 2);
INSERT INTO inverse_service.lines VALUES ('batch', 3, '"c"', 'gone', NULL, 3);
INSERT INTO inverse_service.versions VALUES (1);
ALTER TABLE ONLY inverse_service.batches
    ADD CONSTRAINT batches_pkey PRIMARY KEY (id);
ALTER TABLE ONLY inverse_service.bodies
    ADD CONSTRAINT bodies_pkey PRIMARY KEY (id);
ALTER TABLE ONLY inverse_service.events
    ADD CONSTRAINT events_pkey PRIMARY KEY (id, number);
ALTER TABLE ONLY inverse_service.jobs
    ADD CONSTRAINT jobs_id_key UNIQUE (id);
ALTER TABLE ONLY inverse_service.jobs
    ADD CONSTRAINT jobs_pkey PRIMARY KEY (sequence);
ALTER TABLE ONLY inverse_service.lines
    ADD CONSTRAINT lines_pkey PRIMARY KEY (batch, number);
ALTER TABLE ONLY inverse_service.versions
    ADD CONSTRAINT versions_pkey PRIMARY KEY (version);
CREATE INDEX jobs_finished ON inverse_service.jobs USING btree (finished) WHERE (status <> ALL (ARRAY['accepted'::text, 'running'::text]));
CREATE INDEX jobs_open ON inverse_service.jobs USING btree (client, status) WHERE (status = ANY (ARRAY['accepted'::text, 'running'::text]));
CREATE INDEX jobs_status ON inverse_service.jobs USING btree (status, sequence);
CREATE INDEX jobs_waiting ON inverse_service.jobs USING btree (priority, sequence) WHERE (status = 'accepted'::text);
CREATE INDEX lines_in_order ON inverse_service.lines USING btree (batch, order_number);
CREATE INDEX lines_of_job ON inverse_service.lines USING btree (job, order_number);
SELECT setval('inverse_service.jobs_sequence_seq', 7, true);
