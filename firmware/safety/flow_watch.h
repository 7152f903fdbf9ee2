/* Watches one chamber's valve: does the pressure that is measured change as the valve should make it?
 *
 * Three one-sided sums (CUSUM, Page 1954) of the change that valve and gas do not explain, each with an allowance that lies
 * between what a sound valve and what a stuck one leaves over: a valve stuck filling gains all that it should have let out,
 * one that is shut keeps what should have left or misses what should have come. Allowances are shares of flows, so wrong
 * conductances, capacities and lags pass. Two more with a small allowance warn of what the loop can still make up for. Sums
 * fade within some seconds. Not here: smaller gaps (gap_monitor.h). Units: Pa. */
#ifndef TRIBEND_FLOW_WATCH_H
#define TRIBEND_FLOW_WATCH_H

#include <stdbool.h>
#include <stdint.h>

struct flow_watch_parameters {
    float most_pa;        /* a sum over it is a fault; */
    float missing_pa;     /* that of missing air may be larger: a valve that is late owes more, and less air does no harm */
    float fills_share;    /* of what a valve that fills instead of venting would bring */
    float model_share;    /* of the filling itself that the model may be wrong by there */
    float blocked_share;  /* of what should have come or left */
    float other_share;    /* of the flow that goes the other way */
    float lag_share;      /* of the change within LAG_STEPS that a reading or a valve may still owe */
    float vents_above_pa; /* a chamber below may be a sensor's offset */
    float weak_share;     /* of either flow: what is beyond it */
    float weak_pa;        /* is a warning over this */
    float steady_share;   /* of either flow, where pressure neither rises nor falls: what is missing beyond it */
    float steady_pa;      /* over this may as well be a reading that has gone away */
    float steady_from_pa; /* a chamber below does no harm */
};

struct flow_watch {
    float net_pa;     /* change that the model has lately made in a step, */
    float moved_pa;   /* and the measured pressure */
    float gained_pa;  /* though the valve should have vented */
    float kept_pa;    /* of what should have left */
    float missing_pa; /* of what should have come */
    float lost_pa;    /* air that went missing, either way, */
    float left_pa;    /* or stayed */
    float steady_pa;  /* air that goes missing in a steady pressure */
};

/* One chamber in one control step. */
struct flow_watch_view {
    float estimate_pa;
    float unmodelled_pa; /* change that valve and gas do not explain (pressure_loop.h) */
    float filled_share;  /* of the step in which the valve filled */
    float fill_pa;       /* what filling all the step would have brought, */
    float vent_pa;       /* and venting all of it taken */
};

void flow_watch_default_parameters(struct flow_watch_parameters *parameters);
void flow_watch_init(struct flow_watch *watch);
/* Each control step. Returns bits of enum supervisor_fault. */
uint32_t flow_watch_step(struct flow_watch *watch, const struct flow_watch_parameters *parameters,
                         const struct flow_watch_view *view);
/* Of the last step: the chamber loses air, or keeps it. */
bool flow_watch_loses(const struct flow_watch *watch, const struct flow_watch_parameters *parameters);
/* More air goes in than the reading explains: a large leak, or a true pressure above the reading. Only another sensor can
 * tell which. */
bool flow_watch_doubts(const struct flow_watch *watch, const struct flow_watch_parameters *parameters);
bool flow_watch_keeps(const struct flow_watch *watch, const struct flow_watch_parameters *parameters);

#endif
