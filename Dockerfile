# The two commands of the README:
#   docker build --tag trocar .
#   docker run --rm --volume "$PWD/recordings:/trocar/recordings" trocar            # make demo
#   docker run --rm trocar make test
FROM debian:bookworm-slim

RUN apt-get update \
    && apt-get install --yes --no-install-recommends \
        ca-certificates chromium g++ gcc git libc6-dev libosmesa6 libvulkan1 make mesa-vulkan-drivers python3 python3-dev python3-pip python3-venv \
    && rm -rf /var/lib/apt/lists/*

# Tests that start processes need a user; the browser refuses to run as root.
RUN useradd --create-home trocar && mkdir /trocar && chown trocar /trocar
USER trocar
WORKDIR /trocar
COPY --chown=trocar . .
RUN make .venv/.dev .venv/.all

CMD ["make", "demo"]
