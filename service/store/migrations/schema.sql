CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);

CREATE TABLE assignment_version (
	id INTEGER NOT NULL, 
	assignment TEXT NOT NULL, 
	sha256 VARCHAR(64) NOT NULL, 
	version TEXT NOT NULL, 
	title TEXT NOT NULL, 
	max_marks VARCHAR(32) NOT NULL, 
	content BLOB NOT NULL, 
	created_at DATETIME NOT NULL, 
	CONSTRAINT pk_assignment_version PRIMARY KEY (id), 
	CONSTRAINT uq_assignment_version_sha256 UNIQUE (sha256)
);

CREATE INDEX ix_assignment_version_assignment ON assignment_version (assignment);

CREATE TABLE audit (
	id INTEGER NOT NULL, 
	at DATETIME NOT NULL, 
	actor TEXT NOT NULL, 
	action TEXT NOT NULL, 
	subject VARCHAR(32) NOT NULL, 
	subject_id TEXT NOT NULL, 
	detail JSON NOT NULL, 
	CONSTRAINT pk_audit PRIMARY KEY (id)
);

CREATE INDEX ix_audit_at ON audit (at);

CREATE INDEX ix_audit_subject_subject_id ON audit (subject, subject_id);

CREATE TABLE course (
	id INTEGER NOT NULL, 
	name TEXT NOT NULL, 
	created_at DATETIME NOT NULL, counted_attempt VARCHAR(16) DEFAULT 'latest' NOT NULL, completion_rule VARCHAR(16) DEFAULT 'higher' NOT NULL, 
	CONSTRAINT pk_course PRIMARY KEY (id), 
	CONSTRAINT uq_course_name UNIQUE (name)
);

CREATE TABLE person (
	id INTEGER NOT NULL, 
	created_at DATETIME NOT NULL, operator BOOLEAN DEFAULT 0 NOT NULL, signed_in_at DATETIME, 
	CONSTRAINT pk_person PRIMARY KEY (id)
);

CREATE TABLE batch (
	id VARCHAR(12) NOT NULL, 
	course_id INTEGER NOT NULL, 
	name TEXT NOT NULL, 
	state VARCHAR(16) NOT NULL, 
	refusals JSON NOT NULL, 
	created_at DATETIME NOT NULL, regrade_of VARCHAR(12) CONSTRAINT fk_batch_regrade_of_batch REFERENCES batch (id), 
	CONSTRAINT pk_batch PRIMARY KEY (id), 
	CONSTRAINT fk_batch_course_id_course FOREIGN KEY(course_id) REFERENCES course (id)
);

CREATE TABLE enrolment (
	id INTEGER NOT NULL, 
	course_id INTEGER NOT NULL, 
	person_id INTEGER NOT NULL, 
	student TEXT NOT NULL, 
	role VARCHAR(16) NOT NULL, written TEXT DEFAULT '' NOT NULL, name TEXT DEFAULT '' NOT NULL, email TEXT DEFAULT '' NOT NULL, 
	CONSTRAINT pk_enrolment PRIMARY KEY (id), 
	CONSTRAINT fk_enrolment_course_id_course FOREIGN KEY(course_id) REFERENCES course (id), 
	CONSTRAINT fk_enrolment_person_id_person FOREIGN KEY(person_id) REFERENCES person (id)
);

CREATE UNIQUE INDEX ix_enrolment_course_id_student ON enrolment (course_id, student);

CREATE TABLE submission (
	id INTEGER NOT NULL, 
	enrolment_id INTEGER NOT NULL, 
	assignment TEXT NOT NULL, 
	batch_id VARCHAR(12), 
	attempt INTEGER NOT NULL, 
	sha256 VARCHAR(64) NOT NULL, 
	source TEXT NOT NULL, 
	size INTEGER NOT NULL, 
	packed BLOB NOT NULL, 
	created_at DATETIME NOT NULL, submitted_at DATETIME, days_late INTEGER DEFAULT '0' NOT NULL, staff_only TEXT, exceeded JSON, 
	CONSTRAINT pk_submission PRIMARY KEY (id), 
	CONSTRAINT ck_submission_attempt CHECK (attempt > 0), 
	CONSTRAINT fk_submission_batch_id_batch FOREIGN KEY(batch_id) REFERENCES batch (id), 
	CONSTRAINT fk_submission_enrolment_id_enrolment FOREIGN KEY(enrolment_id) REFERENCES enrolment (id)
);

CREATE INDEX ix_submission_batch_id ON submission (batch_id);

CREATE UNIQUE INDEX ix_submission_enrolment_id_assignment_attempt ON submission (enrolment_id, assignment, attempt);

CREATE INDEX ix_submission_sha256 ON submission (sha256);

CREATE TABLE job (
	id VARCHAR(12) NOT NULL, 
	submission_id INTEGER NOT NULL, 
	assignment_version_id INTEGER NOT NULL, 
	enrolment_id INTEGER NOT NULL, 
	batch_id VARCHAR(12), 
	lane VARCHAR(16) NOT NULL, 
	state VARCHAR(16) NOT NULL, 
	attempt INTEGER NOT NULL, 
	max_attempts INTEGER NOT NULL, 
	due_at DATETIME NOT NULL, 
	lease VARCHAR(32), 
	lease_until DATETIME, 
	heartbeat_at DATETIME, 
	worker TEXT, 
	progress DOUBLE NOT NULL, 
	error TEXT, 
	queued_at DATETIME NOT NULL, 
	notified_at DATETIME, 
	started_at DATETIME, 
	graded_at DATETIME, 
	finished_at DATETIME, 
	verdict VARCHAR(32), 
	marks VARCHAR(32), 
	max_marks VARCHAR(32), 
	grader_version TEXT, 
	sandbox TEXT, 
	notes JSON NOT NULL, 
	plots VARCHAR(16) NOT NULL, 
	plots_due_at DATETIME, 
	plots_attempt INTEGER NOT NULL, 
	plotted_at DATETIME, process INTEGER, phases JSON DEFAULT '{}' NOT NULL, grader_sha256 VARCHAR(64), cache_key VARCHAR(64), forced BOOLEAN DEFAULT 0 NOT NULL, copied_from VARCHAR(12) CONSTRAINT fk_job_copied_from_job REFERENCES job (id), regrade_of VARCHAR(12) CONSTRAINT fk_job_regrade_of_job REFERENCES job (id), standing VARCHAR(16) DEFAULT 'stands' NOT NULL, suspect TEXT, published_at DATETIME, published_by TEXT, secret_sha256 VARCHAR(64), cost JSON, missing TEXT DEFAULT '' NOT NULL, hints JSON DEFAULT '[]' NOT NULL, cancelled_for VARCHAR(16), superseded_by VARCHAR(12), sentences JSON DEFAULT '[]' NOT NULL, whole_pools BOOLEAN DEFAULT 0 NOT NULL, provisional BOOLEAN DEFAULT 0 NOT NULL, 
	CONSTRAINT pk_job PRIMARY KEY (id), 
	CONSTRAINT ck_job_lease CHECK ((state = 'running') = (lease IS NOT NULL)), 
	CONSTRAINT fk_job_assignment_version_id_assignment_version FOREIGN KEY(assignment_version_id) REFERENCES assignment_version (id), 
	CONSTRAINT fk_job_batch_id_batch FOREIGN KEY(batch_id) REFERENCES batch (id), 
	CONSTRAINT fk_job_enrolment_id_enrolment FOREIGN KEY(enrolment_id) REFERENCES enrolment (id), 
	CONSTRAINT fk_job_submission_id_submission FOREIGN KEY(submission_id) REFERENCES submission (id)
);

CREATE INDEX ix_job_assignment_version_id ON job (assignment_version_id);

CREATE INDEX ix_job_enrolment_id ON job (enrolment_id);

CREATE INDEX ix_job_plots_plots_due_at ON job (plots, plots_due_at);

CREATE INDEX ix_job_state_lane_due_at ON job (state, lane, due_at);

CREATE INDEX ix_job_state_lease_until ON job (state, lease_until);

CREATE INDEX ix_job_submission_id ON job (submission_id);

CREATE TABLE artifact (
	id INTEGER NOT NULL, 
	job_id VARCHAR(12) NOT NULL, 
	name TEXT NOT NULL, 
	media_type TEXT NOT NULL, 
	sha256 VARCHAR(64) NOT NULL, 
	size INTEGER NOT NULL, 
	compressed BLOB NOT NULL, 
	created_at DATETIME NOT NULL, 
	CONSTRAINT pk_artifact PRIMARY KEY (id), 
	CONSTRAINT fk_artifact_job_id_job FOREIGN KEY(job_id) REFERENCES job (id) ON DELETE CASCADE
);

CREATE UNIQUE INDEX ix_artifact_job_id_name ON artifact (job_id, name);

CREATE TABLE criterion_result (
	id INTEGER NOT NULL, 
	job_id VARCHAR(12) NOT NULL, 
	position INTEGER NOT NULL, 
	criterion TEXT NOT NULL, 
	title TEXT NOT NULL, 
	marks VARCHAR(32) NOT NULL, 
	max_marks VARCHAR(32) NOT NULL, 
	message TEXT NOT NULL, 
	visibility VARCHAR(32) NOT NULL, 
	evidence JSON NOT NULL, 
	accuracy DOUBLE, 
	accuracy_low DOUBLE, 
	accuracy_high DOUBLE, 
	accuracy_n INTEGER, 
	labels JSON, 
	confusion JSON, 
	predictions JSON NOT NULL, counts JSON, confidence JSON, curves JSON DEFAULT '[]' NOT NULL, shown JSON, for_staff TEXT DEFAULT '' NOT NULL, unjudged TEXT, pool JSON, 
	CONSTRAINT pk_criterion_result PRIMARY KEY (id), 
	CONSTRAINT fk_criterion_result_job_id_job FOREIGN KEY(job_id) REFERENCES job (id) ON DELETE CASCADE
);

CREATE UNIQUE INDEX ix_criterion_result_job_id_position ON criterion_result (job_id, position);

CREATE TABLE trial (
	id INTEGER NOT NULL, 
	job_id VARCHAR(12) NOT NULL, 
	position INTEGER NOT NULL, 
	scenario TEXT NOT NULL, 
	scenario_index INTEGER NOT NULL, 
	seed BIGINT NOT NULL, 
	light_noise DOUBLE NOT NULL, 
	motor_noise DOUBLE NOT NULL, 
	visibility VARCHAR(32) NOT NULL, 
	verdict VARCHAR(32) NOT NULL, 
	sha256 VARCHAR(64) NOT NULL, 
	end_t DOUBLE NOT NULL, sweep JSON DEFAULT '[]' NOT NULL, place INTEGER DEFAULT '0' NOT NULL, surprise TEXT, 
	CONSTRAINT pk_trial PRIMARY KEY (id), 
	CONSTRAINT fk_trial_job_id_job FOREIGN KEY(job_id) REFERENCES job (id) ON DELETE CASCADE
);

CREATE UNIQUE INDEX ix_trial_job_id_position ON trial (job_id, position);

CREATE TABLE policy (
	id INTEGER NOT NULL, 
	course_id INTEGER NOT NULL, 
	assignment TEXT NOT NULL, 
	due_at DATETIME, 
	late_days INTEGER NOT NULL, 
	attempts INTEGER, 
	cool_down_seconds DOUBLE NOT NULL, zone VARCHAR(64) DEFAULT '' NOT NULL, 
	CONSTRAINT pk_policy PRIMARY KEY (id), 
	CONSTRAINT fk_policy_course_id_course FOREIGN KEY(course_id) REFERENCES course (id)
);

CREATE UNIQUE INDEX ix_policy_course_id_assignment ON policy (course_id, assignment);

CREATE TABLE extension (
	id INTEGER NOT NULL, 
	enrolment_id INTEGER NOT NULL, 
	assignment TEXT NOT NULL, 
	due_at DATETIME, 
	more_attempts INTEGER NOT NULL, 
	CONSTRAINT pk_extension PRIMARY KEY (id), 
	CONSTRAINT fk_extension_enrolment_id_enrolment FOREIGN KEY(enrolment_id) REFERENCES enrolment (id)
);

CREATE UNIQUE INDEX ix_extension_enrolment_id_assignment ON extension (enrolment_id, assignment);

CREATE TABLE worker (
	name TEXT NOT NULL, 
	grader_version TEXT NOT NULL, 
	grader_sha256 VARCHAR(64) NOT NULL, 
	first_at DATETIME NOT NULL, 
	self_tested_at DATETIME NOT NULL, 
	quarantined_at DATETIME, 
	reason TEXT, 
	CONSTRAINT pk_worker PRIMARY KEY (name)
);

CREATE TABLE "self_test" (
	id INTEGER NOT NULL, 
	worker TEXT NOT NULL, 
	process INTEGER NOT NULL, 
	right_at DATETIME NOT NULL, 
	CONSTRAINT pk_canary PRIMARY KEY (id)
);

CREATE TABLE "heartbeat" (
	worker TEXT NOT NULL, 
	host TEXT NOT NULL, 
	concurrency INTEGER NOT NULL, 
	grader_version TEXT NOT NULL, 
	sandbox TEXT NOT NULL, 
	started_at DATETIME NOT NULL, 
	seen_at DATETIME NOT NULL, problem TEXT, 
	CONSTRAINT pk_presence PRIMARY KEY (worker)
);

CREATE INDEX ix_job_cache_key ON job (cache_key);

CREATE INDEX ix_job_copied_from ON job (copied_from);

CREATE INDEX ix_job_regrade_of ON job (regrade_of);

CREATE INDEX ix_job_worker_finished_at ON job (worker, finished_at);

CREATE TABLE installation (
	id INTEGER NOT NULL, 
	secret VARCHAR(64) NOT NULL, 
	made_at DATETIME NOT NULL, 
	CONSTRAINT pk_installation PRIMARY KEY (id)
);

CREATE UNIQUE INDEX ix_self_test_worker_process ON self_test (worker, process);

CREATE INDEX ix_heartbeat_seen_at ON heartbeat (seen_at);

CREATE INDEX ix_job_batch_id_state_plots_suspect ON job (batch_id, state, plots, suspect);

CREATE TABLE lti_key (
	id VARCHAR(12) NOT NULL, 
	private_pem TEXT NOT NULL, 
	created_at DATETIME NOT NULL, 
	CONSTRAINT pk_lti_key PRIMARY KEY (id)
);

CREATE TABLE lti_platform (
	id INTEGER NOT NULL, 
	name TEXT NOT NULL, 
	issuer TEXT NOT NULL, 
	client_id TEXT NOT NULL, 
	deployments JSON NOT NULL, 
	authorization_url TEXT NOT NULL, 
	token_url TEXT NOT NULL, 
	keys_url TEXT NOT NULL, 
	created_at DATETIME NOT NULL, service_origins JSON DEFAULT '[]' NOT NULL, 
	CONSTRAINT pk_lti_platform PRIMARY KEY (id)
);

CREATE UNIQUE INDEX ix_lti_platform_issuer_client_id ON lti_platform (issuer, client_id);

CREATE TABLE credential (
	id VARCHAR(12) NOT NULL, 
	person_id INTEGER NOT NULL, 
	kind VARCHAR(16) NOT NULL, 
	sha256 VARCHAR(64) NOT NULL, 
	name TEXT NOT NULL, 
	scopes JSON NOT NULL, 
	course_id INTEGER, 
	created_at DATETIME NOT NULL, 
	expires_at DATETIME NOT NULL, 
	used_at DATETIME, 
	revoked_at DATETIME, role VARCHAR(16), platform_id INTEGER CONSTRAINT fk_credential_platform_id_lti_platform REFERENCES lti_platform (id), token_id VARCHAR(12) CONSTRAINT fk_credential_token_id_credential REFERENCES credential (id), 
	CONSTRAINT pk_credential PRIMARY KEY (id), 
	CONSTRAINT fk_credential_course_id_course FOREIGN KEY(course_id) REFERENCES course (id), 
	CONSTRAINT fk_credential_person_id_person FOREIGN KEY(person_id) REFERENCES person (id), 
	CONSTRAINT uq_credential_sha256 UNIQUE (sha256)
);

CREATE INDEX ix_credential_person_id ON credential (person_id);

CREATE TABLE lti_course (
	id INTEGER NOT NULL, 
	platform_id INTEGER NOT NULL, 
	context TEXT NOT NULL, 
	course_id INTEGER NOT NULL, 
	members_url TEXT, 
	lineitems_url TEXT, deployment TEXT DEFAULT '' NOT NULL, 
	CONSTRAINT pk_lti_course PRIMARY KEY (id), 
	CONSTRAINT fk_lti_course_course_id_course FOREIGN KEY(course_id) REFERENCES course (id), 
	CONSTRAINT fk_lti_course_platform_id_lti_platform FOREIGN KEY(platform_id) REFERENCES lti_platform (id)
);

CREATE INDEX ix_lti_course_course_id ON lti_course (course_id);

CREATE TABLE lti_launch (
	state_sha256 VARCHAR(64) NOT NULL, 
	platform_id INTEGER NOT NULL, 
	nonce VARCHAR(64) NOT NULL, 
	target TEXT NOT NULL, 
	expires_at DATETIME NOT NULL, 
	CONSTRAINT pk_lti_launch PRIMARY KEY (state_sha256), 
	CONSTRAINT fk_lti_launch_platform_id_lti_platform FOREIGN KEY(platform_id) REFERENCES lti_platform (id)
);

CREATE INDEX ix_lti_launch_expires_at ON lti_launch (expires_at);

CREATE TABLE lti_person (
	id INTEGER NOT NULL, 
	platform_id INTEGER NOT NULL, 
	subject TEXT NOT NULL, 
	person_id INTEGER NOT NULL, 
	CONSTRAINT pk_lti_person PRIMARY KEY (id), 
	CONSTRAINT fk_lti_person_person_id_person FOREIGN KEY(person_id) REFERENCES person (id), 
	CONSTRAINT fk_lti_person_platform_id_lti_platform FOREIGN KEY(platform_id) REFERENCES lti_platform (id)
);

CREATE INDEX ix_lti_person_person_id ON lti_person (person_id);

CREATE UNIQUE INDEX ix_lti_person_platform_id_subject ON lti_person (platform_id, subject);

CREATE TABLE webhook (
	id VARCHAR(12) NOT NULL, 
	course_id INTEGER NOT NULL, 
	url TEXT NOT NULL, 
	secret VARCHAR(64) NOT NULL, 
	events JSON NOT NULL, 
	created_at DATETIME NOT NULL, 
	revoked_at DATETIME, 
	CONSTRAINT pk_webhook PRIMARY KEY (id), 
	CONSTRAINT fk_webhook_course_id_course FOREIGN KEY(course_id) REFERENCES course (id)
);

CREATE INDEX ix_webhook_course_id ON webhook (course_id);

CREATE TABLE delivery (
	id VARCHAR(12) NOT NULL, 
	webhook_id VARCHAR(12) NOT NULL, 
	event TEXT NOT NULL, 
	payload JSON NOT NULL, 
	made_at DATETIME NOT NULL, 
	due_at DATETIME, 
	attempts INTEGER NOT NULL, 
	delivered_at DATETIME, 
	error TEXT, 
	CONSTRAINT pk_delivery PRIMARY KEY (id), 
	CONSTRAINT fk_delivery_webhook_id_webhook FOREIGN KEY(webhook_id) REFERENCES webhook (id)
);

CREATE INDEX ix_delivery_delivered_at_due_at ON delivery (delivered_at, due_at);

CREATE INDEX ix_delivery_webhook_id ON delivery (webhook_id);

CREATE TABLE idempotent_reply (
	id INTEGER NOT NULL, 
	credential_id VARCHAR(12) NOT NULL, 
	"key" TEXT NOT NULL, 
	request_sha256 VARCHAR(64) NOT NULL, 
	status INTEGER NOT NULL, 
	body BLOB NOT NULL, 
	made_at DATETIME NOT NULL, 
	CONSTRAINT pk_idempotent_reply PRIMARY KEY (id), 
	CONSTRAINT fk_idempotent_reply_credential_id_credential FOREIGN KEY(credential_id) REFERENCES credential (id)
);

CREATE UNIQUE INDEX ix_idempotent_reply_credential_id_key ON idempotent_reply (credential_id, "key");

CREATE INDEX ix_idempotent_reply_made_at ON idempotent_reply (made_at);

CREATE TABLE tryout (
	id VARCHAR(12) NOT NULL, 
	enrolment_id INTEGER NOT NULL, 
	assignment_version_id INTEGER NOT NULL, 
	packed BLOB NOT NULL, 
	state VARCHAR(16) NOT NULL, 
	lease_until DATETIME, 
	attempt INTEGER NOT NULL, 
	queued_at DATETIME NOT NULL, 
	finished_at DATETIME, 
	words JSON, 
	replay BLOB, 
	error TEXT, 
	CONSTRAINT pk_tryout PRIMARY KEY (id), 
	CONSTRAINT fk_tryout_assignment_version_id_assignment_version FOREIGN KEY(assignment_version_id) REFERENCES assignment_version (id), 
	CONSTRAINT fk_tryout_enrolment_id_enrolment FOREIGN KEY(enrolment_id) REFERENCES enrolment (id)
);

CREATE INDEX ix_tryout_enrolment_id ON tryout (enrolment_id);

CREATE INDEX ix_tryout_state_queued_at ON tryout (state, queued_at);

CREATE TABLE appeal (
	id INTEGER NOT NULL, 
	submission_id INTEGER NOT NULL, 
	text TEXT NOT NULL, 
	asked_at DATETIME NOT NULL, 
	answer TEXT, 
	actor TEXT, 
	answered_at DATETIME, 
	CONSTRAINT pk_appeal PRIMARY KEY (id), 
	CONSTRAINT fk_appeal_submission_id_submission FOREIGN KEY(submission_id) REFERENCES submission (id)
);

CREATE INDEX ix_appeal_asked_at ON appeal (asked_at);

CREATE INDEX ix_appeal_submission_id ON appeal (submission_id);

CREATE TABLE comment (
	id INTEGER NOT NULL, 
	submission_id INTEGER NOT NULL, 
	criterion TEXT NOT NULL, 
	text TEXT NOT NULL, 
	actor TEXT NOT NULL, 
	made_at DATETIME NOT NULL, 
	withdrawn_at DATETIME, 
	CONSTRAINT pk_comment PRIMARY KEY (id), 
	CONSTRAINT fk_comment_submission_id_submission FOREIGN KEY(submission_id) REFERENCES submission (id)
);

CREATE INDEX ix_comment_submission_id ON comment (submission_id);

CREATE TABLE override (
	id INTEGER NOT NULL, 
	submission_id INTEGER NOT NULL, 
	criterion TEXT NOT NULL, 
	marks VARCHAR(32), 
	excused BOOLEAN NOT NULL, 
	reason TEXT NOT NULL, 
	actor TEXT NOT NULL, 
	made_at DATETIME NOT NULL, 
	withdrawn_at DATETIME, 
	CONSTRAINT pk_override PRIMARY KEY (id), 
	CONSTRAINT ck_override_marks CHECK ((marks IS NULL) = excused), 
	CONSTRAINT fk_override_submission_id_submission FOREIGN KEY(submission_id) REFERENCES submission (id)
);

CREATE INDEX ix_override_submission_id_criterion ON override (submission_id, criterion);

CREATE TABLE "open_assignment" (
	id INTEGER NOT NULL, 
	course_id INTEGER NOT NULL, 
	assignment TEXT NOT NULL, 
	assignment_version_id INTEGER NOT NULL, 
	opened_at DATETIME, 
	closed_at DATETIME, 
	names_hidden BOOLEAN NOT NULL, 
	batch_id VARCHAR(12), 
	CONSTRAINT pk_open_assignment PRIMARY KEY (id), 
	CONSTRAINT fk_open_assignment_course_id_course FOREIGN KEY(course_id) REFERENCES course (id), 
	CONSTRAINT fk_open_assignment_assignment_version_id_assignment_version FOREIGN KEY(assignment_version_id) REFERENCES assignment_version (id), 
	CONSTRAINT fk_open_assignment_batch_id_batch FOREIGN KEY(batch_id) REFERENCES batch (id)
);

CREATE UNIQUE INDEX ix_open_assignment_course_id_assignment ON open_assignment (course_id, assignment);

CREATE INDEX ix_open_assignment_batch_id ON open_assignment (batch_id);

CREATE UNIQUE INDEX uq_job_standing ON job (submission_id) WHERE standing = 'stands';

CREATE UNIQUE INDEX ix_lti_course_platform_id_deployment_context ON lti_course (platform_id, deployment, context);

CREATE TABLE schema_compatibility (
	id INTEGER NOT NULL, 
	oldest_compatible VARCHAR(32) NOT NULL, 
	CONSTRAINT pk_schema_compatibility PRIMARY KEY (id)
);

CREATE INDEX ix_credential_token_id ON credential (token_id);

CREATE INDEX ix_job_waiting ON job (state, lane, batch_id, queued_at, id, enrolment_id, due_at) WHERE state = 'queued';

CREATE INDEX ix_job_started_at_lane_batch_id_enrolment_id ON job (started_at, lane, batch_id, enrolment_id);

CREATE TABLE statement_key (
	id VARCHAR(16) NOT NULL, 
	public_hex VARCHAR(64) NOT NULL, 
	private_hex VARCHAR(64), 
	created_at DATETIME NOT NULL, 
	retired_at DATETIME, 
	revoked_at DATETIME, 
	CONSTRAINT pk_statement_key PRIMARY KEY (id)
);

CREATE TABLE statement_entry (
	number INTEGER NOT NULL, 
	leaf_sha256 VARCHAR(64) NOT NULL, 
	made_at DATETIME NOT NULL, 
	submission_id INTEGER, 
	job_id VARCHAR(12), 
	salt VARCHAR(64), 
	opening_key VARCHAR(64), 
	key_id VARCHAR(16), 
	signature VARCHAR(128), 
	payload BLOB, 
	CONSTRAINT pk_statement_entry PRIMARY KEY (number)
);

CREATE INDEX ix_statement_entry_submission_id ON statement_entry (submission_id);

CREATE TABLE statement_head (
	id INTEGER NOT NULL, 
	size INTEGER NOT NULL, 
	root_sha256 VARCHAR(64) NOT NULL, 
	made_at DATETIME NOT NULL, 
	CONSTRAINT pk_statement_head PRIMARY KEY (id)
);

INSERT INTO schema_compatibility VALUES (1, '0019')
