# Build:  docker build -t palpate .
# Run:    docker run --rm -p 127.0.0.1:8000:8000 -e PALPATE_TOKEN=... -v "$PWD/datasets:/data:ro" palpate
# Inside a container the page has to listen on all interfaces, and that is refused without a token: set PALPATE_TOKEN.
# Any other verb:  docker run --rm -v "$PWD/datasets:/data:ro" palpate check /data/gel-block
FROM python:3.11-slim

RUN apt-get update \
    && apt-get install -y --no-install-recommends libegl1 libgl1 libusb-1.0-0 libgomp1 \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home palpate

WORKDIR /opt/palpate
COPY constraints.txt pyproject.toml README.md LICENSE ./
# The CPU build of torch; the default one on Linux brings gigabytes of CUDA.
RUN pip install --no-cache-dir --extra-index-url https://download.pytorch.org/whl/cpu "$(grep '^torch==' constraints.txt)" -c constraints.txt
COPY core core
COPY app app
COPY static static
RUN pip install --no-cache-dir -e . -c constraints.txt

USER palpate
WORKDIR /home/palpate
ENV OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 NUMBA_NUM_THREADS=1
EXPOSE 8000
ENTRYPOINT ["palpate"]
CMD ["serve", "--host", "0.0.0.0", "--port", "8000"]
