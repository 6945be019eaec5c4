# The base image by its tag; to pin it: docker buildx imagetools inspect python:3.11-slim --format '{{.Manifest.Digest}}',
# and then --build-arg BASE=python:3.11-slim@sha256:...
ARG BASE=python:3.11-slim
# Two stages: wheels are built where there is a compiler's worth of tools, the image that runs has none.
FROM ${BASE} AS build
WORKDIR /source
COPY pyproject.toml constraints.txt README.md LICENSE ./
COPY inverse_service inverse_service
COPY api_schemas api_schemas
COPY docs/*.md docs/
# docker build --build-arg EXTRAS=dask,postgres
ARG EXTRAS=""
RUN python -m venv /opt/inverse-service \
    && /opt/inverse-service/bin/pip install --no-cache-dir -c constraints.txt ".${EXTRAS:+[$EXTRAS]}"
# The modular kernels, compiled for the processor of this machine; on another one the service compiles its own.
WORKDIR /
RUN /opt/inverse-service/bin/inverse-service warm
# What runs installs nothing.
RUN /opt/inverse-service/bin/python -m pip uninstall --yes --quiet pip setuptools

FROM ${BASE}
RUN python -m pip uninstall --yes --quiet pip setuptools wheel \
    && groupadd --system --gid 10001 inverse \
    && useradd --system --uid 10001 --gid 10001 --home-dir /nonexistent --shell /usr/sbin/nologin inverse \
    && install -d -o 10001 -g 10001 -m 0700 /var/lib/inverse-service
COPY --from=build /opt/inverse-service /opt/inverse-service
# Works with `docker run --init --read-only --tmpfs /tmp`: compiled kernels and sockets go to /tmp (nothing there has to be
# executable), the jobs to the volume. --init takes the remains of killed workers away.
ENV PATH=/opt/inverse-service/bin:$PATH \
    PYTHONDONTWRITEBYTECODE=1 \
    PYTHONUNBUFFERED=1 \
    XDG_CACHE_HOME=/tmp/cache \
    MPLCONFIGDIR=/tmp/matplotlib \
    INVERSE_SERVICE_DATABASE=/var/lib/inverse-service/jobs.sqlite
USER 10001
VOLUME /var/lib/inverse-service
EXPOSE 8000
STOPSIGNAL SIGTERM
# /livez and not /readyz: a full queue is no reason to restart the service.
HEALTHCHECK --interval=30s --timeout=15s --start-period=60s --retries=3 \
    CMD ["python", "-c", "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8000/livez', timeout=12)"]
CMD ["inverse-service", "serve", "--host", "0.0.0.0", "--port", "8000"]
