"""An LTI 1.3 learning platform: it signs launches, issues tokens, lists members and accepts marks."""

from __future__ import annotations

import json
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import Any
from urllib.parse import parse_qs, urlsplit

import jwt
from cryptography.hazmat.primitives.asymmetric import rsa
from jwt import PyJWKSet
from jwt.algorithms import RSAAlgorithm

from service.lti.launch import CLAIM, GRADES_CLAIM, MEMBERS_CLAIM

CLIENT = "robomark-client"
ISSUER = "https://platform.example.org"
INSTRUCTOR = "http://purl.imsglobal.org/vocab/lis/v2/membership#Instructor"
LEARNER = "http://purl.imsglobal.org/vocab/lis/v2/membership#Learner"
_KEY = rsa.generate_private_key(65537, 2048)
_ADMINISTRATOR = "http://purl.imsglobal.org/vocab/lis/v2/institution/person#Administrator"


@dataclass
class LearningPlatform:
    """The data of the platform, and the requests it received."""

    url: str = ""
    key: rsa.RSAPrivateKey = _KEY
    tool_keys: dict[str, Any] = field(default_factory=dict)
    members: list[dict[str, Any]] = field(default_factory=list)
    columns: list[dict[str, Any]] = field(default_factory=list)
    scores: list[dict[str, Any]] = field(default_factory=list)
    tokens: dict[str, str] = field(default_factory=dict)  # token -> scopes
    paths: list[str] = field(default_factory=list)  # of all requests

    def claims(self, begun: dict[str, str], subject: str, *roles: str, **changes: Any) -> dict[str, Any]:
        at = int(time.time())
        payload = {
            "iss": ISSUER,
            "aud": CLIENT,
            "sub": subject,
            "iat": at,
            "exp": at + 300,
            "nonce": begun["nonce"],
            "name": f"{subject.capitalize()} Example",
            "email": f"{subject}@example.org",
            f"{CLAIM}version": "1.3.0",
            f"{CLAIM}message_type": "LtiResourceLinkRequest",
            f"{CLAIM}deployment_id": "1",
            f"{CLAIM}target_link_uri": "http://localhost/",
            f"{CLAIM}resource_link": {"id": "link"},
            f"{CLAIM}context": {"id": "c1", "title": "Robotics"},
            f"{CLAIM}roles": [_ADMINISTRATOR, *roles],
            f"{CLAIM}lis": {"person_sourcedid": subject},
            MEMBERS_CLAIM: {"context_memberships_url": f"{self.url}/members", "service_versions": ["2.0"]},
            GRADES_CLAIM: {"lineitems": f"{self.url}/columns", "scope": []},
        }
        return {name: value for name, value in (payload | changes).items() if value is not None}

    def sign(self, claims: dict[str, Any], key: rsa.RSAPrivateKey | None = None, **header: Any) -> str:
        return jwt.encode(claims, key or self.key, algorithm="RS256", headers={"kid": "k1", **header})

    def answer(self, method: str, path: str, query: dict[str, list[str]], body: bytes, token: str) -> tuple[int, Any]:
        """Return the answer: a status and JSON."""
        self.paths.append(path)
        if path == "/keys":
            public = json.loads(RSAAlgorithm.to_jwk(self.key.public_key()))
            return 200, {"keys": [{**public, "kid": "k1", "alg": "RS256", "use": "sig"}]}
        if path == "/token":
            return self._give_token(parse_qs(body.decode()))
        if path == "/members":
            if "contextmembership.readonly" not in self.tokens.get(token, ""):
                return 403, {}
            start = int(query.get("from", ["0"])[0])
            return 200, {"id": f"{self.url}/members", "members": self.members[start : start + 2]}
        if "scope/score" not in self.tokens.get(token, ""):
            return 403, {}
        if path == "/columns" and method == "GET":
            wanted = query.get("resource_id", [""])[0]
            return 200, [column for column in self.columns if column["resourceId"] == wanted]
        if path == "/columns":
            self.columns.append({**json.loads(body), "id": f"{self.url}/columns/{len(self.columns) + 1}?kept=1"})
            return 201, self.columns[-1]
        if path.startswith("/columns/") and path.endswith("/scores") and query == {"kept": ["1"]}:
            self.scores.append(json.loads(body))
            return 200, None
        return 404, {}

    def _give_token(self, form: dict[str, list[str]]) -> tuple[int, Any]:
        assertion = form["client_assertion"][0]
        key = PyJWKSet.from_dict(self.tool_keys)[jwt.get_unverified_header(assertion)["kid"]]
        claims = jwt.decode(assertion, key, algorithms=["RS256"], audience=f"{self.url}/token", issuer=CLIENT)
        assert claims["sub"] == CLIENT
        assert form["grant_type"] == ["client_credentials"]
        token = str(uuid.uuid4())
        self.tokens[token] = form["scope"][0]
        return 200, {"access_token": token, "token_type": "Bearer", "expires_in": 3600}


@contextmanager
def learning_platform() -> Iterator[LearningPlatform]:
    """Run a platform on this machine."""
    platform = LearningPlatform()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self._answer("GET")

        def do_POST(self) -> None:
            self._answer("POST")

        def _answer(self, method: str) -> None:
            parts = urlsplit(self.path)
            body = self.rfile.read(int(self.headers.get("content-length", "0")))
            token = self.headers.get("authorization", "").removeprefix("Bearer ")
            status, value = platform.answer(method, parts.path, parse_qs(parts.query), body, token)
            data = b"" if value is None else json.dumps(value).encode()
            self.send_response(status)
            if parts.path == "/members" and status == 200 and len(value["members"]) == 2:
                start = int(parse_qs(parts.query).get("from", ["0"])[0])
                self.send_header("link", f'<{platform.url}/members?from={start + 2}>; rel="next"')
            self.send_header("content-length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

        def log_message(self, *_: Any) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        platform.url = f"http://127.0.0.1:{server.server_address[1]}"
        thread = Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield platform
        finally:
            server.shutdown()
            thread.join()
