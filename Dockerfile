# Lamina's program in a small image: built on Debian 12, installed as its .deb (docs/building.md).
#   docker build -t lamina . && docker run --rm -v "$PWD:/work" lamina surface scan.ply -o mesh.ply
FROM debian:12-slim AS build
WORKDIR /source
COPY scripts/setup scripts/setup
RUN scripts/setup program && apt-get install -y --no-install-recommends dpkg-dev
COPY . .
RUN cmake --preset program -DLAMINA_WITH_MPI=OFF \
    && cmake --build build --target lamina_program \
    && cpack -G DEB --config build/CPackConfig.cmake -B build -D CPACK_COMPONENTS_ALL=program

FROM debian:12-slim
COPY --from=build /source/build/lamina_*.deb /tmp/
RUN apt-get update \
    && apt-get install -y --no-install-recommends /tmp/lamina_*.deb \
    && rm -rf /var/lib/apt/lists/* /tmp/lamina_*.deb
USER nobody
WORKDIR /work
ENTRYPOINT ["lamina"]
