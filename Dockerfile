# SPDX-License-Identifier: BSD-3-Clause
#
# The two commands of README.md on a Debian 12 with nothing on it:
#
#   docker build -t dynslam .                                  # scripts/demo.sh: packages, build, demo
#   docker run --rm dynslam                                    # scripts/test.sh: all tests
#   docker run --rm -v "$PWD/SEQ:/seq:ro" -v "$PWD/out:/out" dynslam dynslam run /seq --out /out
FROM debian:12

# The rest of what is needed, scripts/install-deps.sh installs; it checks nothing it downloads without these.
RUN apt-get update \
  && apt-get install -y --no-install-recommends ca-certificates git \
  && rm -rf /var/lib/apt/lists/*

WORKDIR /dynslam
COPY . .
RUN ./scripts/demo.sh
ENV PATH=/dynslam/build/release/bin:$PATH
CMD ["./scripts/test.sh"]
