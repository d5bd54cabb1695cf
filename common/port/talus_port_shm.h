/* Shared memory transport of the port, for the two that use it from C: talus_port_shm.c tells what each
   call does, libport/port_end.c waits with them. */
#ifndef TALUS_PORT_SHM_H
#define TALUS_PORT_SHM_H
#include <stdint.h>

enum { TEXT = 128 }; /* bytes of a run id, place or host */
/* At which stage a segment could not be made or joined. */
enum { STAGE_OPEN = 1, STAGE_SPACE, STAGE_MAP, STAGE_LOCK, STAGE_ABSENT, STAGE_FOREIGN, STAGE_DAMAGED,
       STAGE_RUN };

struct port;

struct port *talus_shm_create(const char *name, int64_t slot, const char *run_id,
                              const char *place, const char *host, int *stage, int *code);
struct port *talus_shm_connect(const char *name, const char *run_id, const char *place,
                               const char *host, int *stage, int *code);
int talus_shm_write(struct port *p, const void *from, int64_t total, int64_t *done, double slice);
int64_t talus_shm_incoming(struct port *p, double slice);
int talus_shm_read(struct port *p, void *to, int64_t total, int64_t *done, double slice);
int talus_shm_partner(struct port *p, char *place, char *host, int room);
int64_t talus_shm_partner_beat(struct port *p);
int talus_shm_partner_gone(struct port *p);
int talus_shm_partner_waits(struct port *p);
int talus_shm_damage(struct port *p, char *text, int room);
int talus_shm_stranger(struct port *p);
int talus_shm_unlocked(const char *name);
void talus_shm_run_id(struct port *p, char *text, int room);
void talus_shm_beat(struct port *p);
void talus_shm_close(struct port *p);

/* common/base/talus_crc64.c */
uint64_t talus_crc64_bytes(const void *data, int64_t bytes, uint64_t before);
#endif
