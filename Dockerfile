# The base by its tag. To pin it:
#   docker buildx imagetools inspect python:3.11-slim --format '{{.Manifest.Digest}}'
#   docker build --build-arg BASE=python:3.11-slim@sha256:... .
ARG BASE=python:3.11-slim
# Two stages: the first has pip, the second what runs.
FROM ${BASE} AS build
WORKDIR /source
COPY deploy/image deploy/image
RUN python -m venv /build \
    && /build/bin/pip install --no-cache-dir --require-hashes -r deploy/image/requirements-build.txt \
    && python -m venv --without-pip /opt/inverse-service
# docker build --build-arg EXTRAS=dask,postgres
ARG EXTRAS=""
RUN for extra in $(echo "$EXTRAS" | tr , ' '); do chosen="$chosen -r deploy/image/requirements-$extra.txt"; done; \
    /build/bin/pip --python /opt/inverse-service/bin/python install --no-cache-dir --require-hashes --no-compile \
      -r deploy/image/requirements.txt $chosen
COPY pyproject.toml publication.toml hatch_build.py README.md LICENSE ./
COPY docs/*.md docs/
COPY api_schemas api_schemas
COPY inverse_service inverse_service
# The kernels are compiled below, by the versions of numba and LLVM that the image has.
RUN INVERSE_SERVICE_WHEEL=pure /build/bin/pip wheel --no-deps --no-build-isolation --wheel-dir /build/wheels . \
    && /build/bin/pip --python /opt/inverse-service/bin/python install --no-deps --no-compile /build/wheels/*.whl \
    && /opt/inverse-service/bin/python -m compileall -q /opt/inverse-service
# The kernels of the solver, compiled for every processor of this platform.
RUN apt-get update && apt-get install --yes --no-install-recommends binutils \
    && /opt/inverse-service/bin/python -m inverse_service.service.compiling

FROM ${BASE}
# What runs installs nothing.
RUN python -m pip uninstall --yes --quiet pip setuptools wheel \
    && python -c "import ensurepip, shutil; shutil.rmtree(ensurepip.__path__[0])" \
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
USER 10001:10001
VOLUME /var/lib/inverse-service
EXPOSE 8000
STOPSIGNAL SIGTERM
# /livez and not /readyz: a full queue is no reason to restart the service.
HEALTHCHECK --interval=30s --timeout=15s --start-period=60s --retries=3 \
    CMD ["python", "-c", "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8000/livez', timeout=12)"]
CMD ["inverse-service", "serve", "--host", "0.0.0.0", "--port", "8000"]
