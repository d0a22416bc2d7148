# Builds, tests and starts the demonstration:
#   docker build --tag isotruss . && docker run --rm --volume "$PWD/demo_output:/isotruss/demo_output" isotruss
FROM ros:jazzy
SHELL ["/bin/bash", "-c"]
WORKDIR /isotruss
COPY . .
RUN tools/workspace.sh install && rm -rf /var/lib/apt/lists/*
RUN source /opt/ros/jazzy/setup.bash && tools/workspace.sh build
RUN source /opt/ros/jazzy/setup.bash && tools/workspace.sh test
CMD ["tools/workspace.sh", "demo"]
