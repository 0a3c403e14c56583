# One image for every process of the service; docker-compose.yml says which one runs.
FROM python:3.11-slim
# The C compiler builds the arm's equations into machine code; without one, solves run ten times slower.
RUN apt-get update && apt-get install --yes --no-install-recommends gcc libc6-dev && rm -rf /var/lib/apt/lists/*
WORKDIR /app
COPY requirements.lock ./
RUN python -m venv /opt/armature && /opt/armature/bin/pip install --no-cache-dir --require-hashes -r requirements.lock
COPY . .
RUN /opt/armature/bin/pip install --no-cache-dir --no-deps --no-build-isolation .

# The volume of compiled kernels takes its owner from this folder.
RUN useradd --system --uid 10001 --user-group --create-home --home-dir /var/lib/armature armature \
    && install --directory --owner=armature /var/lib/armature/shared
USER 10001
ENV PATH=/opt/armature/bin:$PATH ARMATURE_HOME=/var/lib/armature PYTHONUNBUFFERED=1
EXPOSE 8000
CMD ["python", "-m", "api.main", "--host", "0.0.0.0", "--port", "8000"]
