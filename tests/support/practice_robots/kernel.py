"""The practice robots' integrator: winding, gear, bristles, tyre, battery and sensors at 0.2 ms steps."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from support.practice_robots.physics import Physics

STEP_S = 2e-4
STEPS_PER_MS = 5
ANGLE, TRAVEL, COUNTS, FILTERED, X, Y, HEADING, YAW_RATE, SUPPLY, WARM = 0, 2, 4, 6, 8, 9, 10, 11, 12, 13
"""Columns of a row: of both wheels the encoder's angle, the ground's travel, counts, filtered speed; pose."""


@numba.njit(cache=True, nogil=True, error_model="numpy")
def simulate(
    p: Physics,
    effort: NDArray[np.float64],
    disturbance: NDArray[np.float64],
    start: NDArray[np.bool_],
    row: NDArray[np.bool_],
    quantised: bool,
    random: np.random.Generator,
) -> NDArray[np.float64]:
    """Drive the robot through a set of runs laid end to end; one output row per marked millisecond's end.

    Parameters
    ----------
    effort, disturbance
        (n, 2) per ms: commanded effort, and disturbing torque in effort units.
    start
        (n,) true at the first ms of a run, where the robot stands still at the origin.
    row
        (n,) true where a log row ends.
    quantised
        Counts are whole and lost at random; otherwise the same in the mean.

    Returns
    -------
    (rows, 15): encoder angle (rad) 2, ground travel (m) 2, counts 2, filtered rim speed (m/s) 2,
    x, y (m), heading (rad), yaw rate (rad/s), supply (V), relative rise of the windings' resistance 2.
    """
    n = effort.shape[0]
    out = np.zeros((int(row.sum()), 15))
    fetched = 0
    h = STEP_S
    two_pi = 2.0 * np.pi

    two_mass = p.gear_stiffness > 0.0
    slipping = p.grip > 0.0
    bristle = p.running[0] + p.running[1] + p.breakaway[0] + p.breakaway[1] > 0.0
    heated = p.heat_rate > 0.0
    stall = p.torque_constant * p.voltage / p.resistance
    stall_current = p.voltage / p.resistance
    first_inertia = np.empty(2)
    middle_inertia = np.empty(2)
    last_inertia = np.empty(2)
    bristle_stiffness = np.zeros(2)
    bristle_damping = np.zeros(2)
    for w in range(2):
        rotor = p.inertia[w] * p.rotor_share[w]
        wheel = p.inertia[w] * p.wheel_share[w]
        first_inertia[w] = rotor
        middle_inertia[w] = wheel if two_mass else rotor + wheel
        last_inertia[w] = p.inertia[w] - rotor - wheel
        if not slipping:
            if two_mass:
                middle_inertia[w] = p.inertia[w] - rotor
            else:
                middle_inertia[w] = p.inertia[w]
        bristle_stiffness[w] = p.running[w] / p.bristle_rad
        bristle_damping[w] = 0.6 * np.sqrt(bristle_stiffness[w] * p.inertia[w])
    scrub_stiffness = p.scrub / (2.0 * p.bristle_rad)
    scrub_damping = 0.6 * np.sqrt(scrub_stiffness * p.inertia[0])
    normal = (p.inertia[0] * (1 - p.rotor_share[0] - p.wheel_share[0])) / p.radius**2 * 9.81

    angle1 = np.zeros(2)  # gear's input side, with the encoder
    angle2 = np.zeros(2)  # wheel
    speed1 = np.zeros(2)
    speed2 = np.zeros(2)
    ground = np.zeros(2)  # rim speed that the ground sees, rad/s of a rolling wheel
    current = np.zeros(2)
    deflection = np.zeros(2)
    scrub_deflection = 0.0
    torque1 = np.zeros(2)
    torque2 = np.zeros(2)
    warm = np.zeros(2)
    case = np.zeros(2)
    resistance = p.resistance.copy()
    charge = 0.0
    supply = p.voltage
    drawn = 0.0
    command = np.zeros(2)
    lagged = np.zeros(2)
    held = np.zeros(2)
    travel = np.zeros(2)
    measured = np.zeros(2)  # encoder angle after its own faults, rad
    lost = np.zeros(2)
    whole = np.zeros(2)
    lost_whole = np.zeros(2)
    phase = random.random(2)
    for w in range(2):
        whole[w] = np.floor(phase[w])
    filtered = np.zeros(2)
    x = 0.0
    y = 0.0
    heading = 0.0
    begin = 0
    tripped = 0
    screw_slips = np.zeros(2)
    pushed = 0
    push_sign = 1.0
    inertia_factor = np.ones(2)
    outer = np.zeros(2)

    for ms in range(n):
        if start[ms]:
            begin = ms
            speed1[:] = 0.0
            speed2[:] = 0.0
            ground[:] = 0.0
            current[:] = 0.0
            lagged[:] = 0.0
            held[:] = 0.0
            deflection[:] = 0.0
            scrub_deflection = 0.0
            travel[:] = 0.0
            filtered[:] = 0.0
            x = 0.0
            y = 0.0
            heading = 0.0
            tripped = 0
            pushed = 0
            screw_slips[:] = 0.0
            drawn = 0.0
            if two_mass:
                for w in range(2):
                    angle2[w] = angle1[w]
        # The driver, at 1 kHz.
        asked = abs(effort[ms, 0]) + abs(effort[ms, 1])
        if tripped > 0:
            tripped -= 1
        elif asked > p.brownout_effort and random.random() < p.brownout_rate * 1e-3:
            tripped = p.brownout_ms
        for w in range(2):
            source = ms - p.delay_ms
            u = effort[source, w] if source >= begin else 0.0
            zero = u == 0.0
            if p.hysteresis > 0.0:
                if u > held[w] + p.hysteresis:
                    held[w] = u - p.hysteresis
                elif u < held[w] - p.hysteresis:
                    held[w] = u + p.hysteresis
                u = held[w]
            if p.effort_power != 1.0:
                u = np.sign(u) * abs(u) ** p.effort_power
            if p.lag_s > 0.0:
                lagged[w] += (u - lagged[w]) * (1.0 - np.exp(-1e-3 / p.lag_s))
                u = lagged[w]
            if p.deadband > 0.0:
                u = np.sign(u) * max(abs(u) - p.deadband, 0.0)
            if u < 0.0:
                u *= p.reverse_supply[w]
            if p.hunting > 0.0 and not zero:
                u += p.hunting * np.sin(two_pi * p.hunting_hz * ms * 1e-3 + 1.3 * w)
            if ms >= p.jump_ms:
                u *= p.jump_factor
            if tripped > 0:
                u = 0.0
            command[w] = u
            floating = zero and p.coast_brake < 1.0 and abs(lagged[w]) < 1e-3
            if floating:
                command[w] = np.nan
            # Slow loads, held for the millisecond.
            load = disturbance[ms, w] * stall[w]
            if p.slope_torque != 0.0:
                load -= p.slope_torque * np.cos(heading - p.uphill)
            if p.tether > 0.0:
                along = x * np.cos(heading) + y * np.sin(heading)
                away = np.sqrt(x * x + y * y)
                if away > p.tether_slack:
                    load -= p.tether * (away - p.tether_slack) * (along / away) * p.radius / 2.0
            inertia_factor[w] = 1.0
            if ms >= p.payload_ms:
                inertia_factor[w] = p.payload_ratio
            if speed2[w] < 0.0:
                inertia_factor[w] *= p.reverse_inertia
            outer[w] = load
            if screw_slips[w] > 0.0:
                screw_slips[w] -= 1.0
        on_patch = p.patch > 0.0 and np.floor((x - p.patch_x) / p.patch_width) % 2 == 0
        if p.push_every_ms < n:
            if pushed > 0:
                pushed -= 1
                outer[0] += push_sign * p.push
                outer[1] += push_sign * p.push
            elif random.random() < 1.0 / p.push_every_ms:
                pushed = 120
                push_sign = 1.0 if random.random() < 0.5 else -1.0

        for _ in range(STEPS_PER_MS):
            drawn_now = 0.0
            scrub_torque = 0.0
            if p.scrub > 0.0:
                apart = speed2[0] - speed2[1]
                rate = scrub_stiffness / p.scrub * abs(apart)
                updated = (scrub_deflection + h * apart) / (1.0 + h * rate)
                scrub_torque = scrub_stiffness * updated + scrub_damping * (updated - scrub_deflection) / h
                scrub_deflection = updated
            for w in range(2):
                k = p.torque_constant[w]
                if np.isnan(command[w]):
                    target = -p.coast_brake * k * speed1[w] / resistance[w]
                    drive = 0.0
                else:
                    drive = command[w]
                    if p.speed_limit < 1e6:
                        limit = p.speed_limit / p.top_mps
                        rim = speed1[w] * p.radius / p.top_mps
                        drive = min(drive, max(limit + 20.0 * (limit - rim), 0.0))
                        drive = max(drive, min(-limit - 20.0 * (limit + rim), 0.0))
                    target = (drive * supply - k * speed1[w]) / resistance[w]
                torque_limit = p.current_limit * stall_current[w]
                target = min(max(target, -torque_limit), torque_limit)
                current[w] += h / (p.electric_s[w] + h) * (target - current[w])
                drawn_now += drive * current[w]
                torque = k * current[w] - p.viscous[w] * speed1[w]
                if p.screw_torque < 1e6:
                    let_go = p.screw_torque * stall[w]
                    if abs(torque) > let_go and screw_slips[w] <= 0.0:
                        screw_slips[w] = 300.0
                    if screw_slips[w] > 0.0:
                        torque *= p.screw_hold
                if p.ripple[w] != 0.0:
                    turn = p.ripple_per_rev * angle1[w] + p.ripple_phase[w]
                    torque += p.ripple[w] * (np.sin(turn) + 0.2 * np.sin(2.0 * turn + 1.0))
                if bristle and p.running[w] > 0.0:
                    level = p.running[w]
                    if p.breakaway[w] > level:
                        slow = speed1[w] / p.stribeck_radps
                        level += (p.breakaway[w] - level) * np.exp(-slow * slow)
                    updated = (deflection[w] + h * speed1[w]) / (
                        1.0 + h * bristle_stiffness[w] * abs(speed1[w]) / level
                    )
                    torque -= (
                        bristle_stiffness[w] * updated + bristle_damping[w] * (updated - deflection[w]) / h
                    )
                    deflection[w] = updated
                torque1[w] = torque
                load = outer[w] - p.drag[w] * speed2[w] * abs(speed2[w])
                load -= scrub_torque if w == 0 else -scrub_torque
                if on_patch:
                    load -= p.patch * np.tanh(speed2[w] / 0.1)
                torque2[w] = load
                if two_mass:
                    twist = angle1[w] - angle2[w]
                    half = 0.5 * p.gap[w]
                    contact = 0.0
                    if twist > half:
                        contact = p.gear_stiffness * (twist - half)
                        contact += p.gear_damping * (speed1[w] - speed2[w])
                        contact = max(contact, 0.0) if half > 0.0 else contact
                    elif twist < -half:
                        contact = p.gear_stiffness * (twist + half)
                        contact += p.gear_damping * (speed1[w] - speed2[w])
                        contact = min(contact, 0.0) if half > 0.0 else contact
                    speed1[w] += h * (torque1[w] - contact) / first_inertia[w]
                    torque1[w] = contact
            if slipping:
                for w in range(2):
                    rim = speed2[w]
                    over = p.slip_slope * (rim - ground[w]) / (abs(ground[w]) + 0.15 / p.radius)
                    force = p.grip * normal * p.radius * np.tanh(over)
                    speed2[w] += h * (torque1[w] - force) / middle_inertia[w]
                    torque2[w] += force
            c = p.coupling
            body0 = (last_inertia[0] if slipping else middle_inertia[0]) + (
                inertia_factor[0] - 1.0
            ) * p.inertia[0]
            body1 = (last_inertia[1] if slipping else middle_inertia[1]) + (
                inertia_factor[1] - 1.0
            ) * p.inertia[1]
            total0 = torque2[0] if slipping else torque1[0] + torque2[0]
            total1 = torque2[1] if slipping else torque1[1] + torque2[1]
            raw0 = total0 / body0
            raw1 = total1 / body1
            rate0 = (raw0 - c * raw1) / (1.0 - c * c)
            rate1 = (raw1 - c * raw0) / (1.0 - c * c)
            if slipping:
                ground[0] += h * rate0
                ground[1] += h * rate1
            else:
                speed2[0] += h * rate0
                speed2[1] += h * rate1
                ground[0] = speed2[0]
                ground[1] = speed2[1]
            for w in range(2):
                angle2[w] += h * speed2[w]
                if two_mass:
                    angle1[w] += h * speed1[w]
                else:
                    speed1[w] = speed2[w]
                    angle1[w] = angle2[w]
                travel[w] += h * ground[w] * p.radius * p.ground_scale[w]
            if p.source_ohm > 0.0 or p.charge_drop > 0.0:
                charge += h * drawn_now
                drawn += (drawn_now - drawn) * 0.2
                supply = p.voltage * (1.0 - p.charge_drop * charge) - p.source_ohm * drawn

        # Heat, pose and sensors, at 1 kHz.
        for w in range(2):
            if heated:
                ratio = current[w] / stall_current[w]
                flow = (warm[w] - case[w]) / p.winding_case_s
                warm[w] += 1e-3 * (p.heat_rate * ratio * ratio * (1.0 + warm[w]) - flow)
                case[w] += 1e-3 * (p.case_ratio * flow - case[w] / p.case_air_s)
                resistance[w] = p.resistance[w] * (1.0 + warm[w])
        left = ground[0] * p.radius * p.ground_scale[0]
        right = ground[1] * p.radius * p.ground_scale[1]
        along_speed = 0.5 * (left + right)
        yaw = (right - left) / (p.wheelbase * p.wheelbase_factor) + p.heading_drift * along_speed
        along_speed *= p.distance_scale
        x += 1e-3 * along_speed * np.cos(heading + 5e-4 * yaw)
        y += 1e-3 * along_speed * np.sin(heading + 5e-4 * yaw)
        heading += 1e-3 * yaw
        for w in range(2):
            per_rad = p.counts_per_rev[w] / two_pi
            seen = angle1[w]
            if p.eccentricity[w] != 0.0:
                wobble = np.sin(angle1[w] + p.eccentric_phase[w]) - np.sin(p.eccentric_phase[w])
                seen += p.eccentricity[w] * wobble
            change = seen - measured[w]
            measured[w] = seen
            loss = 0.0
            if p.lost_at_top[w] > 0.0:
                loss = min(p.lost_at_top[w] * abs(speed1[w]) * p.radius / p.top_mps, 1.0)
                lost[w] += loss * change
            now = np.floor(seen * per_rad + phase[w])
            step = now - whole[w]
            whole[w] = now
            if loss > 0.0:
                kept = 0.0
                for _ in range(int(abs(step))):
                    if random.random() >= loss:
                        kept += 1.0
                kept = kept if step > 0 else -kept
                lost_whole[w] += step - kept
                step = kept
            if p.speed_filter_s > 0.0:
                per_ms = step / per_rad if quantised else change * (1.0 - loss)
                share = 1.0 - np.exp(-1e-3 / p.speed_filter_s)
                filtered[w] += share * (per_ms * p.radius * 1e3 - filtered[w])
        if row[ms]:
            for w in range(2):
                out[fetched, 0 + w] = measured[w] - lost[w]
                out[fetched, 2 + w] = travel[w]
                out[fetched, 4 + w] = whole[w] - lost_whole[w]
                out[fetched, 6 + w] = filtered[w]
            out[fetched, 8] = x
            out[fetched, 9] = y
            out[fetched, 10] = heading
            out[fetched, 11] = yaw
            out[fetched, 12] = supply
            out[fetched, 13] = warm[0]
            out[fetched, 14] = warm[1]
            fetched += 1
    return out
