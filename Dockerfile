# Build:  docker build -t palpate .
# Check:  docker run --rm -v "$PWD/my-block:/data:ro" palpate check /data
# Page:   docker run --rm --network host -v "$PWD/datasets:/srv/palpate/datasets:ro" -v palpate-runs:/srv/palpate/runs palpate
# It listens on the loopback address only: with --network host that is the host's own.
FROM python:3.11-slim

RUN apt-get update \
    && apt-get install -y --no-install-recommends libegl1 libgl1 libusb-1.0-0 libgomp1 \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home palpate \
    && install -d -o palpate /srv/palpate /srv/palpate/datasets /srv/palpate/runs

WORKDIR /opt/palpate
COPY constraints.txt pyproject.toml README.md LICENSE ./
COPY .ci/requirements.txt .ci/
# The CPU build of torch; the default one on Linux brings gigabytes of CUDA.
RUN pip install --no-cache-dir --extra-index-url https://download.pytorch.org/whl/cpu "$(grep '^torch==' constraints.txt)" -c constraints.txt
RUN pip install --no-cache-dir --no-deps --require-hashes -r .ci/requirements.txt
COPY core core
COPY app app
COPY static static
RUN pip install --no-cache-dir --no-deps --no-build-isolation .

USER palpate
WORKDIR /srv/palpate
ENV OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 NUMBA_NUM_THREADS=1
ENTRYPOINT ["palpate"]
CMD ["serve"]
